"use strict";(()=>{var k={iso:[-Math.PI/4,.6155],top:[0,Math.PI/2],front:[0,0],right:[Math.PI/2,0]},N=class{turn=k.iso[0];tilt=k.iso[1];target=[0,0,0];scale=4;width=1;height=1;radius=100;basis(){let[t,e,n,i]=[Math.cos(this.turn),Math.sin(this.turn),Math.sin(this.tilt),Math.cos(this.tilt)];return[[t,e,0],[-e*n,t*n,i],[e*i,-t*i,n]]}fit(t){let[e,n]=t??[[-50,-50,-50],[50,50,50]];this.target=[0,1,2].map(a=>(e[a]+n[a])/2);let i=[0,1,2].map(a=>n[a]-e[a]);this.radius=Math.max(Math.hypot(...i)/2,.001);let[s,r]=this.basis(),l=a=>Math.max(a.reduce((h,u,m)=>h+Math.abs(u)*i[m],0),this.radius/50);this.scale=.86*Math.min(this.width/l(s),this.height/l(r))}look(t,e){[this.turn,this.tilt]=k[t]??k.iso,this.fit(e)}orbit(t,e){this.turn-=t*.008,this.tilt=Math.max(-Math.PI/2,Math.min(Math.PI/2,this.tilt+e*.008))}pan(t,e){let[n,i]=this.basis();for(let s=0;s<3;s++)this.target[s]+=(-t*n[s]+e*i[s])/this.scale}zoom(t,e,n){let i=this.scale,s=.02*Math.min(this.width,this.height)/this.radius;this.scale=Math.max(s,Math.min(1e5,i*t));let r=this.scale/i;this.pan(e-e*r,n-n*r)}project(t,e,n){let[i,s,r]=this.basis(),l=[t-this.target[0],e-this.target[1],n-this.target[2]],a=h=>h[0]*l[0]+h[1]*l[1]+h[2]*l[2];return[this.width/2+this.scale*a(i),this.height/2-this.scale*a(s),a(r)]}matrix(){let[t,e,n]=this.basis(),i=4*this.radius+Math.hypot(...this.target),s=[t.map(l=>l*2*this.scale/this.width),e.map(l=>l*2*this.scale/this.height),n.map(l=>-l/i)],r=new Float32Array(16);return s.forEach((l,a)=>{for(let h=0;h<3;h++)r[4*h+a]=l[h];r[12+a]=-l.reduce((h,u,m)=>h+u*this.target[m],0)}),r[15]=1,r}};var Q=["rapid","feed","arc","probe, tap"];function J(o){let t=atob(o),e=new Uint8Array(t.length);for(let n=0;n<t.length;n++)e[n]=t.charCodeAt(n);return e}function I(o){return new Float32Array(J(o).buffer)}function Z(o){let{machine:t,...e}=o;return{...e,machine:t&&{...t},positions:I(o.positions),kinds:J(o.kinds),lines:new Uint32Array(J(o.lines).buffer),times:I(o.times),feeds:I(o.feeds),joints:t?I(t.values):new Float32Array}}function ut(){return{uri:"",count:0,tools:[],bounds:null,cut:null,stock:null,seconds:0,rapidSeconds:0,cutLength:0,rapidLength:0,truncated:!1,machine:null,positions:new Float32Array,kinds:new Uint8Array,lines:new Uint32Array,times:new Float32Array,feeds:new Float32Array,joints:new Float32Array}}function R(o,t){let e=0,n=o.count-1;for(;e<n;){let i=e+n+1>>1;o.times[i]<=t?e=i:n=i-1}return Math.max(e,0)}function mt(o,t){let e=[];for(let n=0;n<o.count;n++)o.lines[n]===t&&n>0&&o.kinds[n]!==255&&e.push(n);return e}function dt(o,t){return o.tools.findLast(e=>e.point<=t)}var p=(o,t,e)=>[o/255,t/255,e/255],_={background:p(255,255,255),kinds:[p(226,119,38),p(24,92,190),p(15,146,106),p(158,54,160)],faint:p(216,220,228),mark:p(214,20,60),stock:p(150,140,120),axes:[p(200,40,40),p(30,130,50),p(40,70,200)],tool:p(40,44,52),measure:p(90,40,160),text:"#282c34"},pt={background:p(30,32,38),kinds:[p(240,150,70),p(97,160,255),p(70,205,150),p(220,120,220)],faint:p(66,70,80),mark:p(255,90,120),stock:p(140,130,110),axes:[p(235,90,90),p(90,200,110),p(110,140,255)],tool:p(230,230,235),measure:p(200,160,255),text:"#d7dae0"};function v(o){return`rgb(${o.map(t=>Math.round(t*255)).join(" ")})`}var tt=64;function et(o){let t=[{name:"feed",unit:"mm/min",value:i=>o.feeds[i],limits:[null,null]}],e=o.machine;if(!e||o.joints.length===0)return t;let n=e.joints.length;return e.joints.forEach((i,s)=>{t.push({name:i,unit:e.units[s],value:r=>o.joints[r*n+s],limits:e.limits[s]??[null,null]}),t.push({name:`${i} speed`,unit:`${e.units[s]}/s`,value:r=>wt(o,r,s,n),limits:[null,null]})}),t}function wt(o,t,e,n){let i=t>0?o.times[t]-o.times[t-1]:0;return i>1e-6?(o.joints[t*n+e]-o.joints[(t-1)*n+e])/i:Number.NaN}function At(o,t,e){let n=new Float64Array(e).fill(Number.POSITIVE_INFINITY),i=new Float64Array(e).fill(Number.NEGATIVE_INFINITY),s=(e-1)/Math.max(o.times[o.count-1]??0,1e-6);for(let r=0;r<o.count;r++){let l=Math.min(e-1,Math.max(0,Math.round(o.times[r]*s))),a=t.value(r);a<n[l]&&(n[l]=a),a>i[l]&&(i[l]=a)}return{low:n,high:i}}var U=class{constructor(t){this.canvas=t}picture=null;key="";draw(t,e,n,i){let s=devicePixelRatio||1,r=Math.max(2,Math.round(this.canvas.clientWidth*s)),l=Math.max(2,Math.round(this.canvas.clientHeight*s)),a=`${e.name} ${r} ${l} ${n.text}`;(this.key!==a||!this.picture)&&(this.picture=this.paint(t,e,n,r,l,s),this.key=a),this.canvas.width=r,this.canvas.height=l;let h=this.canvas.getContext("2d");if(!h)return;h.drawImage(this.picture,0,0);let u=Math.max(t.times[t.count-1]??0,1e-6),m=tt*s+i/u*(r-(tt+8)*s);h.fillStyle=v(n.mark),h.fillRect(Math.round(m),0,s,l);let b=t.count?e.value(R(t,i)):Number.NaN;h.font=`${12*s}px sans-serif`,h.textAlign=m>r/2?"right":"left",h.fillText(Number.isFinite(b)?`${+b.toFixed(2)} ${e.unit}`:"",m+(m>r/2?-6:6)*s,13*s)}forget(){this.picture=null}paint(t,e,n,i,s,r){let l=document.createElement("canvas");l.width=i,l.height=s;let a=l.getContext("2d");if(!a||t.count===0)return l;let h=tt*r,u=Math.max(2,Math.floor(i-h-8*r)),{low:m,high:b}=At(t,e,u),[f,g]=[Number.POSITIVE_INFINITY,Number.NEGATIVE_INFINITY];for(let c=0;c<u;c++)m[c]<f&&(f=m[c]),b[c]>g&&(g=b[c]);g>f||([f,g]=Number.isFinite(f)?[f-1,g+1]:[0,1]);let y=c=>s-6*r-(c-f)/(g-f)*(s-24*r);a.fillStyle=n.text,a.font=`${11*r}px sans-serif`,a.textAlign="right",a.fillText(String(+g.toPrecision(5)),h-4*r,y(g)+4*r),a.fillText(String(+f.toPrecision(5)),h-4*r,y(f)),a.strokeStyle=v(n.mark),a.setLineDash([4,4]);for(let c of e.limits)c===null||c<f||c>g||(a.beginPath(),a.moveTo(h,y(c)),a.lineTo(h+u,y(c)),a.stroke());a.setLineDash([]),a.strokeStyle=v(n.kinds[1]),a.lineWidth=r,a.beginPath();let A=!1;for(let c=0;c<u;c++)m[c]>b[c]||(A?a.lineTo(h+c,y(m[c])):a.moveTo(h+c,y(m[c])),a.lineTo(h+c,y(b[c])),A=!0);return a.stroke(),l}};var kt=60;function Et(o){let t=10**Math.floor(Math.log10(o));return[1,2,5,10].map(e=>e*t).find(e=>e>=o*.999)??10*t}var H=class{constructor(t){this.canvas=t}draw(t,e,n,i){let s=devicePixelRatio||1,{width:r,height:l}=e;this.canvas.width=Math.round(r*s),this.canvas.height=Math.round(l*s);let a=this.canvas.getContext("2d");if(a){a.scale(s,s),a.font="bold 12px sans-serif",a.textAlign="center",a.textBaseline="middle";for(let h of[0,1,2]){let u=[0,0,0];u[h]=i.axis*1.12;let[m,b]=e.project(...u);a.fillStyle=v(n.axes[h]),a.fillText("XYZ"[h],m,b)}this.tools(a,t,e,n,i.until);for(let h of i.points)this.ring(a,e.project(...h),v(n.measure),5);i.tool&&this.cone(a,e.project(...i.tool),v(n.mark)),this.scale(a,e,n)}}tools(t,e,n,i,s){t.font="11px sans-serif",t.textAlign="left";for(let r of e.tools.slice(0,kt)){if(r.point>=e.count||r.point>=s)continue;let l=[0,1,2].map(m=>e.positions[3*r.point+m]),[a,h]=n.project(...l);t.fillStyle=v(i.tool),t.beginPath(),t.moveTo(a,h-5),t.lineTo(a+4,h),t.lineTo(a,h+5),t.lineTo(a-4,h),t.fill();let u=r.diameter?` ⌀${+r.diameter.toFixed(3)}`:"";t.fillText(`T${r.number}${u}`,a+8,h-8)}}ring(t,[e,n],i,s){t.strokeStyle=i,t.lineWidth=2,t.beginPath(),t.arc(e,n,s,0,2*Math.PI),t.stroke()}cone(t,[e,n],i){t.fillStyle=i,t.beginPath(),t.moveTo(e,n),t.lineTo(e-6,n-16),t.lineTo(e+6,n-16),t.fill()}scale(t,e,n){let i=Et(80/e.scale),s=e.width-16,r=e.height-14;t.strokeStyle=t.fillStyle=n.text,t.lineWidth=2,t.beginPath(),t.moveTo(s-i*e.scale,r),t.lineTo(s,r),t.stroke(),t.textAlign="right",t.fillText(`${+i.toPrecision(6)} mm`,s,r-10)}};var D=class{element=document.createElement("div");space=document.createElement("div");window=document.createElement("div");lines=[];marked=-1;constructor(t){this.element.className="listing",this.element.tabIndex=0,this.window.className="window",this.space.append(this.window),this.element.append(this.space),this.element.addEventListener("scroll",()=>this.draw()),this.window.addEventListener("click",e=>{let n=e.target.closest("[data-line]")?.dataset.line;n&&t(Number(n))}),new ResizeObserver(()=>this.draw()).observe(this.element)}show(t){this.lines=t.split(/\r\n|\n|\r/),this.space.style.height=`${Math.min(this.lines.length*18,8e6)}px`,this.draw()}mark(t,e){this.marked=t;let n=this.element.clientHeight/18,i=this.element.scrollTop/(18*this.ratio());e&&(t<i||t>i+n-2)&&(this.element.scrollTop=(t-n/2)*18*this.ratio()),this.draw()}ratio(){return Math.min(1,8e6/Math.max(this.lines.length*18,1))}draw(){let t=this.element.scrollTop,e=Math.ceil(this.element.clientHeight/18)+1,n=Math.max(0,this.lines.length-e+2),i=Math.min(Math.floor(t/(18*this.ratio())),n);this.window.style.transform=`translateY(${t}px)`;let s=[];for(let r=i;r<Math.min(i+e,this.lines.length);r++){let l=document.createElement("div");l.dataset.line=String(r),l.className=r===this.marked?"row marked":"row";let a=document.createElement("i");a.textContent=String(r+1),l.append(a,this.lines[r]),s.push(l)}this.window.replaceChildren(...s)}};function ft(o,t,e,n,i,s,r){let{positions:l,kinds:a}=o,[h,u,m]=t.basis(),[b,f,g]=t.target,y=t.scale,A=e-t.width/2,c=t.height/2-n,T=null,S=i*i,it=Number.NEGATIVE_INFINITY,[C,L,O]=[0,0,0],yt=Math.min(o.count,r);for(let x=0;x<yt;x++){let z=l[3*x]-b,Y=l[3*x+1]-f,j=l[3*x+2]-g,st=y*(h[0]*z+h[1]*Y+h[2]*j)-A,rt=y*(u[0]*z+u[1]*Y+u[2]*j)-c,ot=m[0]*z+m[1]*Y+m[2]*j;if(x>0&&a[x]!==255&&s&1<<a[x]){let P=st-C,B=rt-L,at=P*P+B*B,M=at>0?Math.max(0,Math.min(1,-(C*P+L*B)/at)):0,lt=C+M*P,ht=L+M*B,q=lt*lt+ht*ht,ct=O+M*(ot-O);if(q<S-.25||q<S+.25&&ct>it){S=Math.min(S,q),it=ct;let K=X=>l[3*(x-1)+X]+M*(l[3*x+X]-l[3*(x-1)+X]);T={point:x,share:M,place:[K(0),K(1),K(2)]}}}C=st,L=rt,O=ot}return T}var E=1e5,Tt=6;function nt(o,t,e,n,i){let{positions:s,kinds:r}=o,{count:l,at:a}=t,h=e*e,u=0,m=0;for(let b=0;b<l;b++){let f=a(b),g=b+1<l?a(b+1):-1;if(!(b===0||g<0||r[f]===255||r[g]===255)&&!(n&&r[f]!==r[g])){let A=s[3*f]-s[3*m],c=s[3*f+1]-s[3*m+1],T=s[3*f+2]-s[3*m+2];if(A*A+c*c+T*T<=h)continue}if(i){if(u===i.length)return u+1;i[u]=f}u++,m=f}return u}function Mt(o){if(!o.bounds)return 1;let[t,e]=o.bounds;return Math.max(...e.map((n,i)=>n-t[i]),.001)}function bt(o,t,e){let n=Mt(o);for(let s of[!0,!1]){let r=n/10,l=n/1e5;if(nt(o,t,r,s,null)>e)continue;for(let h=0;h<7;h++){let u=Math.sqrt(r*l);nt(o,t,u,s,null)>e?l=u:r=u}let a=new Uint32Array(e);return a.slice(0,nt(o,t,r,s,a))}let i=Math.ceil(t.count/e);return Uint32Array.from({length:Math.floor(t.count/i)},(s,r)=>t.at(r*i))}function gt(o){if(o.count<=E)return[];let t=[bt(o,{count:o.count,at:e=>e},E)];for(let e=1;e<Tt;e++){let n=t[e-1];t.push(bt(o,{count:n.length,at:i=>n[i]},E>>e))}return t}var Rt=`#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in uint kind;
uniform mat4 view;
uniform vec2 shift;
uniform vec3 colors[8];
uniform uint shown;
uniform vec4 only;
flat out vec4 color;
void main() {
  vec4 p = view * vec4(place, 1.0);
  gl_Position = vec4(p.xy + shift, clamp(p.z, -1.0, 1.0), 1.0);
  bool hidden = kind > 7u || (shown & (1u << kind)) == 0u;
  color = only.a > 0.0 ? vec4(only.rgb, kind > 7u ? 0.0 : 1.0) : vec4(colors[min(kind, 7u)], hidden ? 0.0 : 1.0);
}`,Ft=`#version 300 es
precision mediump float;
flat in vec4 color;
out vec4 paint;
void main() {
  if (color.a < 0.5) discard;
  paint = color;
}`;function vt(o,t,e){let n=o.createShader(t);if(!n)throw new Error("the graphics context is lost");if(o.shaderSource(n,e),o.compileShader(n),!o.getShaderParameter(n,o.COMPILE_STATUS))throw new Error(o.getShaderInfoLog(n)??"shader");return n}var F=class{constructor(t){this.canvas=t;let e=t.getContext("webgl2",{antialias:!1,powerPreference:"high-performance"});if(!e)throw new Error("this browser has no WebGL 2");this.gl=e;let n=e.getExtension("WEBGL_debug_renderer_info");this.device=String(n?e.getParameter(n.UNMASKED_RENDERER_WEBGL):e.getParameter(e.RENDERER));let i=/swiftshader|llvmpipe|software/i.test(this.device);this.samples=i?0:Math.min(4,e.getParameter(e.MAX_SAMPLES));let s=e.createProgram();e.attachShader(s,vt(e,e.VERTEX_SHADER,Rt)),e.attachShader(s,vt(e,e.FRAGMENT_SHADER,Ft)),e.linkProgram(s),e.useProgram(s);for(let r of["view","shift","colors","shown","only"])this.uniforms[r]=e.getUniformLocation(s,r);this.path=e.createVertexArray(),this.extra=e.createVertexArray(),this.places=e.createBuffer(),this.kinds=e.createBuffer(),this.reduced=e.createVertexArray(),this.reducedPlaces=e.createBuffer(),this.reducedKinds=e.createBuffer(),this.extraPlaces=e.createBuffer(),this.target=e.createFramebuffer(),this.paint=e.createRenderbuffer(),this.depth=e.createRenderbuffer(),this.attributes(this.path,this.places,this.kinds),this.attributes(this.reduced,this.reducedPlaces,this.reducedKinds),this.attributes(this.extra,this.extraPlaces,null)}gl;device;drawn={segments:0,whole:!0};uniforms={};path;extra;places;kinds;reduced;reducedPlaces;reducedKinds;extraPlaces;target;paint;depth;samples;size=[0,0];count=0;levels=[];level=0;lastQuick=0;waiting=0;aside=!0;step=E;attributes(t,e,n){let i=this.gl;i.bindVertexArray(t),i.bindBuffer(i.ARRAY_BUFFER,e),i.enableVertexAttribArray(0),i.vertexAttribPointer(0,3,i.FLOAT,!1,0,0),n&&(i.bindBuffer(i.ARRAY_BUFFER,n),i.enableVertexAttribArray(1),i.vertexAttribIPointer(1,1,i.UNSIGNED_BYTE,0,0))}load(t){let e=this.gl;this.stop(),this.count=t.count,this.levels=gt(t),this.level=Math.min(this.level,Math.max(this.levels.length-1,0)),e.bindBuffer(e.ARRAY_BUFFER,this.places),e.bufferData(e.ARRAY_BUFFER,t.positions,e.STATIC_DRAW),e.bindBuffer(e.ARRAY_BUFFER,this.kinds),e.bufferData(e.ARRAY_BUFFER,t.kinds,e.STATIC_DRAW);let n=this.levels.reduce((l,a)=>l+a.length,0),i=new Float32Array(3*n),s=new Uint8Array(n),r=0;for(let l of this.levels)for(let a of l)i.set(t.positions.subarray(3*a,3*a+3),3*r),s[r++]=t.kinds[a];e.bindBuffer(e.ARRAY_BUFFER,this.reducedPlaces),e.bufferData(e.ARRAY_BUFFER,i,e.STATIC_DRAW),e.bindBuffer(e.ARRAY_BUFFER,this.reducedKinds),e.bufferData(e.ARRAY_BUFFER,s,e.STATIC_DRAW)}resize(t,e){if(this.size[0]===t&&this.size[1]===e)return;let n=this.gl;this.size=[t,e],this.canvas.width=t,this.canvas.height=e,n.bindRenderbuffer(n.RENDERBUFFER,this.paint),n.renderbufferStorageMultisample(n.RENDERBUFFER,this.samples,n.RGBA8,t,e),n.bindRenderbuffer(n.RENDERBUFFER,this.depth),n.renderbufferStorageMultisample(n.RENDERBUFFER,this.samples,n.DEPTH_COMPONENT24,t,e),n.bindFramebuffer(n.FRAMEBUFFER,this.target),n.framebufferRenderbuffer(n.FRAMEBUFFER,n.COLOR_ATTACHMENT0,n.RENDERBUFFER,this.paint),n.framebufferRenderbuffer(n.FRAMEBUFFER,n.DEPTH_ATTACHMENT,n.RENDERBUFFER,this.depth)}stop(){cancelAnimationFrame(this.waiting),this.waiting=0}quick(t,e){this.stop(),this.begin(t,this.samples===0?null:this.target);let n=this.levels.length===0;return n?this.strip(t,0,this.count):(this.adapt(e),this.thin(t)),this.finish(t,(n?this.count:this.levels[this.level].length)-1,n),n}adapt(t){let e=t-this.lastQuick;this.lastQuick=t;let n=e>200?3:e>100?2:1;e>50&&e<1e3?this.level=Math.min(this.level+n,this.levels.length-1):e<18&&e>0&&(this.level=Math.max(this.level-1,0))}whole(t,e){this.stop(),this.begin(t,this.target);let n=0,i=0,s=r=>{i&&r-i<20?this.step=Math.min(this.step*2,4e6):i&&r-i>120&&(this.step=Math.max(this.step/2,E/2)),i=r,this.gl.bindFramebuffer(this.gl.FRAMEBUFFER,this.target);let l=Math.min(this.count,n+Math.floor(this.step));this.strip(t,n,l),n=l,n<this.count?(this.gl.flush(),this.waiting=requestAnimationFrame(s)):(this.waiting=0,this.finish(t,this.count-1,!0),e())};this.waiting=requestAnimationFrame(s)}begin(t,e){let n=this.gl;this.aside=e!==null,n.bindFramebuffer(n.FRAMEBUFFER,e),n.viewport(0,0,this.size[0],this.size[1]),n.clearColor(...t.background,1),n.clear(n.COLOR_BUFFER_BIT|n.DEPTH_BUFFER_BIT),n.enable(n.DEPTH_TEST),n.depthFunc(n.LEQUAL),n.uniformMatrix4fv(this.uniforms.view,!1,t.matrix),n.uniform2f(this.uniforms.shift,0,0),n.uniform1ui(this.uniforms.shown,t.shown),n.uniform4f(this.uniforms.only,0,0,0,0),n.uniform3fv(this.uniforms.colors,t.colors.flat())}shade(t,e){let n=e?t.colors.map(()=>t.faint):t.colors;this.gl.uniform3fv(this.uniforms.colors,n.flat())}strip(t,e,n){let i=this.gl;i.bindVertexArray(this.path);let s=(l,a)=>{let h=Math.max(l-1,0);a-h>1&&i.drawArrays(i.LINE_STRIP,h,a-h)},r=Math.min(Math.max(t.until,e),n);this.shade(t,!1),s(e,r),r<n&&(this.shade(t,!0),s(r,n))}thin(t){let e=this.gl,n=this.levels[this.level],i=this.levels.slice(0,this.level).reduce((l,a)=>l+a.length,0);e.bindVertexArray(this.reduced);let s=n.length;if(t.until<this.count)for(s=0;s<n.length&&n[s]<t.until;)s++;let r=(l,a)=>{let h=Math.max(l-1,0);a-h>1&&e.drawArrays(e.LINE_STRIP,i+h,a-h)};this.shade(t,!1),r(0,s),s<n.length&&(this.shade(t,!0),r(s,n.length))}finish(t,e,n){let i=this.gl;for(let s of t.extras)this.lines(s.places,s.color);if(this.mark(t),this.aside){i.bindFramebuffer(i.READ_FRAMEBUFFER,this.target),i.bindFramebuffer(i.DRAW_FRAMEBUFFER,null);let[s,r]=this.size;i.blitFramebuffer(0,0,s,r,0,0,s,r,i.COLOR_BUFFER_BIT,i.NEAREST)}this.drawn={segments:Math.max(e,0),whole:n}}lines(t,e){let n=this.gl;n.bindVertexArray(this.extra),n.bindBuffer(n.ARRAY_BUFFER,this.extraPlaces),n.bufferData(n.ARRAY_BUFFER,t,n.STREAM_DRAW),n.vertexAttribI4ui(1,0,0,0,0),n.uniform4f(this.uniforms.only,...e,1),n.drawArrays(n.LINES,0,t.length/3),n.uniform4f(this.uniforms.only,0,0,0,0)}mark(t){if(t.marked.length===0)return;let e=this.gl;e.disable(e.DEPTH_TEST);for(let[n,i]of[[0,0],[1,0],[-1,0],[0,1],[0,-1]])e.uniform2f(this.uniforms.shift,2*n/this.size[0],2*i/this.size[1]),this.lines(t.marked,t.mark);e.uniform2f(this.uniforms.shift,0,0)}};var xt=`:host {
  display: grid;
  grid-template: auto 1fr auto auto / 1fr auto;
  height: 100%;
  min-height: 0;
  overflow: hidden;
  font:
    13px system-ui,
    sans-serif;
  color: var(--text);
  background: var(--background);
}
.bar,
.time {
  display: flex;
  flex-wrap: wrap;
  align-items: center;
  gap: 4px 10px;
  padding: 5px 10px;
}
.bar {
  grid-column: 1 / 3;
}
.bar b {
  font-size: 14px;
}
.bar .facts {
  opacity: 0.8;
}
.bar .warning {
  color: var(--mark);
}
.view {
  position: relative;
  min-width: 0;
  min-height: 0;
  overflow: hidden;
}
.view canvas {
  position: absolute;
  inset: 0;
  width: 100%;
  height: 100%;
  display: block;
}
.view canvas.labels {
  pointer-events: none;
}
.view canvas.path {
  cursor: grab;
  touch-action: none;
}
.view.measuring canvas.path {
  cursor: crosshair;
}
.note {
  position: absolute;
  left: 10px;
  bottom: 8px;
  max-width: calc(100% - 20px);
  white-space: pre-line;
  pointer-events: none;
  background: color-mix(in srgb, var(--background) 85%, transparent);
  padding: 2px 6px;
  border-radius: 4px;
}
.note:empty {
  display: none;
}
.legend {
  display: flex;
  gap: 10px;
  flex-wrap: wrap;
}
.legend label {
  display: inline-flex;
  align-items: center;
  gap: 4px;
  white-space: nowrap;
  cursor: pointer;
}
.legend i {
  width: 18px;
  height: 3px;
}
button,
select {
  font: inherit;
  color: inherit;
  background: color-mix(in srgb, var(--text) 8%, transparent);
  border: 1px solid color-mix(in srgb, var(--text) 25%, transparent);
  border-radius: 4px;
  padding: 1px 7px;
  cursor: pointer;
}
select option {
  color: #222;
  background: #fff;
}
button[aria-pressed="true"] {
  background: color-mix(in srgb, var(--feed) 35%, transparent);
}
.time {
  grid-column: 1 / 3;
}
.time input {
  flex: 1;
  min-width: 120px;
  accent-color: var(--feed);
}
.time output {
  min-width: 130px;
  font-variant-numeric: tabular-nums;
}
.curve {
  grid-column: 1 / 3;
  height: 90px;
  border-top: 1px solid color-mix(in srgb, var(--text) 20%, transparent);
}
.curve canvas {
  width: 100%;
  height: 100%;
  display: block;
  cursor: pointer;
}
.curve[hidden],
.listing[hidden] {
  display: none;
}
.listing {
  width: min(34vw, 420px);
  overflow: auto;
  border-left: 1px solid color-mix(in srgb, var(--text) 20%, transparent);
  font:
    12px / 18px ui-monospace,
    monospace;
  outline: none;
}
.listing > div {
  position: relative;
}
.listing .row {
  white-space: pre;
  height: 18px;
  padding-right: 8px;
  cursor: pointer;
}
.listing .row i {
  display: inline-block;
  min-width: 4.5em;
  padding-right: 1em;
  text-align: right;
  opacity: 0.5;
  font-style: normal;
}
.listing .row.marked {
  background: color-mix(in srgb, var(--mark) 22%, transparent);
}
`;var Ct=150,Lt=8,Pt=[1,2,5,10,50,100,500];function d(o,t={}){return Object.assign(document.createElement(o),t)}function $(o){let t=e=>String(Math.floor(e)).padStart(2,"0");return`${Math.floor(o/3600)}:${t(o/60%60)}:${t(o%60)}`}var w=o=>String(+o.toFixed(3)),W=class extends HTMLElement{scene=ut();theme=_;chosenTheme=null;camera=new N;renderer=null;root=this.attachShadow({mode:"open"});view=d("div",{className:"view"});canvas=d("canvas",{className:"path"});labels=new H(d("canvas",{className:"labels"}));facts=d("span",{className:"facts"});warning=d("span",{className:"warning"});title_=d("b");legend=d("span",{className:"legend"});note=d("div",{className:"note"});slider=d("input",{type:"range",min:"0",max:"1000",value:"1000",ariaLabel:"time"});output=d("output");playing=d("button",{textContent:"▶",title:"play (space)",ariaLabel:"play"});speed=d("select",{title:"times real speed",ariaLabel:"speed"});curve=d("select",{title:"curve",ariaLabel:"curve"});curveBox=d("div",{className:"curve"});plot=new U(d("canvas"));measuring=d("button",{textContent:"measure",title:"distance between two points of the path"});listing=new D(t=>{this.line=t,this.chose(t)});shown=255;marked=new Float32Array;markedLine=-1;seconds=Number.POSITIVE_INFINITY;player=0;queued=0;rest=0;points=[];frames=[];connectedCallback(){if(this.renderer)return;let t=new CSSStyleSheet;t.replaceSync(xt),this.root.adoptedStyleSheets=[t],this.build();try{this.renderer=new F(this.canvas)}catch(e){this.warning.textContent=`${e.message}: the tool path can't be drawn`}matchMedia("(prefers-color-scheme: dark)").addEventListener("change",()=>this.paintTheme()),new MutationObserver(()=>this.paintTheme()).observe(document.body,{attributeFilter:["class"]}),new ResizeObserver(()=>this.resize()).observe(this.view),this.canvas.addEventListener("webglcontextlost",e=>e.preventDefault()),this.canvas.addEventListener("webglcontextrestored",()=>{this.renderer=new F(this.canvas),this.renderer.load(this.scene),this.resize()}),this.paintTheme(),this.resize()}setScene(t){let e=this.scene.count===0,n=this.seconds>=this.end();this.scene=t,this.points=[],this.pause(),this.renderer?.load(t),this.plot.forget(),e&&this.camera.fit(V(t)),this.describe(),this.findMarked(),this.seconds=e||n?this.end():Math.min(this.seconds,this.end()),this.draw(!1)}setText(t){this.listing.element.hidden=!1,this.listing.show(t)}set heading(t){this.title_.textContent=t}set problem(t){this.warning.textContent=t}set line(t){this.markedLine=t,this.findMarked(),this.listing.mark(t,!0),this.draw(!1)}get line(){return this.markedLine}look(t){this.camera.look(t,V(this.scene)),this.draw(!1)}orbit(t,e){this.camera.orbit(t,e),this.draw(!0)}project(t,e,n){let i=this.canvas.getBoundingClientRect(),[s,r]=this.camera.project(t,e,n);return[i.left+s,i.top+r]}statistics(){return{...this.renderer?.drawn??{segments:0,whole:!1},device:this.renderer?.device??"",points:this.scene.count,frames:[...this.frames],busy:this.rest!==0||this.queued!==0}}build(){let t=d("div",{className:"bar"}),e=d("span");for(let s of Object.keys(k)){let r=d("button",{textContent:s});r.onclick=()=>this.look(s),e.append(r," ")}let n=d("button",{textContent:"◐",title:"light or dark",ariaLabel:"light or dark"});n.onclick=()=>{this.chosenTheme=this.theme===_?"dark":"light",this.paintTheme()},this.measuring.onclick=()=>this.measure(this.measuring.ariaPressed!=="true"),t.append(this.title_,this.facts,e,this.measuring,n,this.legend,this.warning),this.view.append(this.canvas,this.labels.canvas,this.note),this.listing.element.hidden=!0;let i=d("div",{className:"time"});for(let s of Pt)this.speed.append(d("option",{value:String(s),textContent:`${s}×`}));this.speed.value="10",i.append(this.playing,this.slider,this.output,this.speed,this.curve),this.curveBox.append(this.plot.canvas),this.curveBox.hidden=!0,this.root.append(t,this.view,this.listing.element,i,this.curveBox),this.listen(),this.describe()}listen(){this.slider.oninput=()=>{this.pause(),this.goto(Number(this.slider.value)/1e3*this.end())},this.playing.onclick=()=>this.player?this.pause():this.play(),this.curve.onchange=()=>{this.curveBox.hidden=this.curve.value==="",this.drawCurve()},this.plot.canvas.onpointerdown=t=>this.gotoColumn(t.offsetX),this.plot.canvas.onpointermove=t=>{t.buttons&&this.gotoColumn(t.offsetX)},this.tabIndex=0,this.addEventListener("keydown",t=>this.key(t)),this.pointer()}gotoColumn(t){this.pause(),this.goto((t-64)/(this.plot.canvas.clientWidth-72)*this.end())}key(t){let e=t.composedPath()[0];if(e instanceof HTMLInputElement||e instanceof HTMLSelectElement)return;let n=Object.keys(k),i={ArrowLeft:[-20,0],ArrowRight:[20,0],ArrowUp:[0,-20],ArrowDown:[0,20]};if(t.key===" ")this.player?this.pause():this.play();else if(t.key==="Escape")this.measure(!1);else if(i[t.key])this.orbit(...i[t.key]);else if(n[Number(t.key)-1])this.look(n[Number(t.key)-1]);else return;t.preventDefault()}pointer(){let t=null,e=0,n=this.canvas;n.onpointerdown=i=>{t=[i.clientX,i.clientY],e=0,n.setPointerCapture(i.pointerId)},n.onpointermove=i=>{if(!t)return;let s=i.clientX-t[0],r=i.clientY-t[1];e+=Math.abs(s)+Math.abs(r),t=[i.clientX,i.clientY],i.shiftKey||i.buttons&6?this.camera.pan(s,r):this.camera.orbit(s,r),this.draw(!0)},n.onpointerup=i=>{t&&e<4&&i.button===0&&this.clicked(i.offsetX,i.offsetY),t=null},n.onwheel=i=>{i.preventDefault();let{width:s,height:r}=this.camera;this.camera.zoom(Math.exp(-i.deltaY*.0015),i.offsetX-s/2,i.offsetY-r/2),this.draw(!0)},n.ondblclick=()=>{this.camera.fit(V(this.scene)),this.draw(!1)},n.oncontextmenu=i=>i.preventDefault()}clicked(t,e){let n=ft(this.scene,this.camera,t,e,Lt,this.shown,this.until());if(this.measuring.ariaPressed==="true"){if(!n)return;this.points=this.points.length===2?[n]:[...this.points,n],this.draw(!1);return}if(!n){this.line=-1;return}let i=this.scene.lines[n.point];this.line=i,this.tell(n),this.chose(i)}chose(t){this.dispatchEvent(new CustomEvent("choose",{detail:{line:t}}))}tell(t){let e=this.scene,n=dt(e,t.point),i=e.feeds[t.point];this.note.textContent=[`line ${e.lines[t.point]+1}: ${Q[e.kinds[t.point]]??""} to ${this.place(t.point)}`,[i?`${w(i)} mm/min`:"",$(e.times[t.point]),n?`T${n.number}`:""].filter(Boolean).join(" · ")].join(`
`)}place(t){return[0,1,2].map(e=>`${"XYZ"[e]}${w(this.scene.positions[3*t+e])}`).join(" ")}measure(t){this.measuring.ariaPressed=String(t),this.view.classList.toggle("measuring",t),this.points=[],this.note.textContent=t?"click two points of the path":"",this.draw(!1)}measured(){if(this.points.length<2)return;let[t,e]=this.points.map(i=>i.place),n=e.map((i,s)=>i-t[s]);this.note.textContent=`${w(Math.hypot(...n))} mm
ΔX ${w(n[0])}  ΔY ${w(n[1])}  ΔZ ${w(n[2])}`}describe(){let t=this.scene,e=t.bounds?t.bounds[1].map((s,r)=>w(s-(t.bounds?.[0][r]??0))).join(" × "):"";this.facts.textContent=t.count?`${e} mm · ${$(t.seconds)} h · cut ${w(t.cutLength/1e3)} m · rapid ${w(t.rapidLength/1e3)} m`:"no moves",t.truncated&&(this.warning.textContent="the path is longer than what is shown"),this.drawLegend();let n=this.curve.value,i=et(t).map(s=>d("option",{value:s.name,textContent:`${s.name}, ${s.unit}`}));this.curve.replaceChildren(d("option",{value:"",textContent:"no curve"}),...i),this.curve.value=i.some(s=>s.value===n)?n:"",this.curveBox.hidden=this.curve.value===""}drawLegend(){let t=new Set(this.scene.kinds),e=Q.map((n,i)=>{if(!t.has(i))return"";let s=d("input",{type:"checkbox",checked:(this.shown&1<<i)!==0});s.onchange=()=>{this.shown^=1<<i,this.draw(!1)};let r=d("i");r.style.background=v(this.theme.kinds[i]);let l=d("label");return l.append(s,r,n),l});this.legend.replaceChildren(...e)}paintTheme(){let t=document.body.classList,e=t.contains("vscode-dark")||t.contains("vscode-high-contrast"),n=t.contains("vscode-light")||t.contains("vscode-high-contrast-light"),i=matchMedia("(prefers-color-scheme: dark)").matches,s=this.chosenTheme??(n?"light":e||i?"dark":"light");this.theme=s==="dark"?pt:_,this.style.setProperty("--background",v(this.theme.background)),this.style.setProperty("--text",this.theme.text),this.style.setProperty("--mark",v(this.theme.mark)),this.style.setProperty("--feed",v(this.theme.kinds[1])),this.plot.forget(),this.drawLegend(),this.draw(!1)}resize(){let{clientWidth:t,clientHeight:e}=this.view;if(!t||!e)return;let n=this.camera.width===1;this.camera.width=t,this.camera.height=e,n&&this.camera.fit(V(this.scene));let i=devicePixelRatio||1;this.renderer?.resize(Math.round(t*i),Math.round(e*i)),this.draw(!1)}end(){return this.scene.count?this.scene.times[this.scene.count-1]:0}until(){return this.seconds>=this.end()?this.scene.count:Math.min(this.scene.count,R(this.scene,this.seconds)+1)}goto(t){this.seconds=Math.max(0,Math.min(this.end(),t)),this.draw(!0)}play(){if(!this.scene.count)return;this.seconds>=this.end()&&(this.seconds=0),this.playing.textContent="❚❚";let t=performance.now(),e=n=>{let i=(n-t)/1e3*Number(this.speed.value);t=n,this.goto(this.seconds+i),this.player=this.seconds<this.end()?requestAnimationFrame(e):0,this.player||this.pause()};this.player=requestAnimationFrame(e)}pause(){cancelAnimationFrame(this.player),this.player=0,this.playing.textContent="▶"}toolPlace(){let t=this.scene;if(!t.count||this.seconds>=this.end())return null;let e=R(t,this.seconds),n=Math.min(e+1,t.count-1),i=t.times[n]-t.times[e],s=i>0?Math.min(1,(this.seconds-t.times[e])/i):0,r=l=>t.positions[3*e+l]+s*(t.positions[3*n+l]-t.positions[3*e+l]);return[r(0),r(1),r(2)]}findMarked(){let t=this.markedLine<0?[]:mt(this.scene,this.markedLine);this.marked=new Float32Array(6*t.length),t.forEach((n,i)=>{this.marked.set(this.scene.positions.subarray(3*n-3,3*n+3),6*i)}),this.note.textContent="";let e=t.at(-1);e!==void 0&&this.tell({point:e,share:1,place:[0,0,0]})}picture(){let t=this.axisLength(),n=[0,1,2].map(r=>{let l=new Float32Array(6);return l[3+r]=t,{places:l,color:this.theme.axes[r]}});this.scene.stock&&n.push({places:Bt(this.scene.stock),color:this.theme.stock});let[i,s]=this.points;return s&&n.push({places:Float32Array.from([...i.place,...s.place]),color:this.theme.measure}),{matrix:this.camera.matrix(),background:this.theme.background,colors:this.theme.kinds,shown:this.shown,until:this.until(),faint:this.theme.faint,marked:this.marked,mark:this.theme.mark,extras:n}}axisLength(){let t=this.scene.bounds;return t?Math.max(...t[1].map((e,n)=>e-t[0][n]),1)/8:10}draw(t){clearTimeout(this.rest),this.rest=0,this.queued||=requestAnimationFrame(e=>{this.queued=0,this.frames.push(e),this.frames.length>240&&this.frames.shift(),this.paint(t,e)})}paint(t,e){this.drawTime(),this.measured(),this.labels.draw(this.scene,this.camera,this.theme,{axis:this.axisLength(),tool:this.toolPlace(),points:this.points.map(i=>i.place),until:this.until()}),!(!this.renderer||this.renderer.quick(this.picture(),e))&&(this.rest=window.setTimeout(()=>{this.renderer?.whole(this.picture(),()=>{this.rest=0})},t?Ct:0))}drawTime(){this.slider.value=String(this.end()?this.seconds/this.end()*1e3:0),this.output.textContent=`${$(this.seconds)} / ${$(this.end())}`,this.drawCurve()}drawCurve(){let t=et(this.scene).find(e=>e.name===this.curve.value);t&&this.plot.draw(this.scene,t,this.theme,this.seconds)}};function V(o){let{bounds:t,stock:e}=o;if(!t||!e)return t??e;let n=(i,s)=>t[s].map((r,l)=>i(r,e[s][l]));return[n(Math.min,0),n(Math.max,1)]}function Bt([o,t]){let e=i=>[0,1,2].map(s=>i>>s&1?t[s]:o[s]),n=[];for(let i=0;i<8;i++)for(let s=0;s<3;s++)i>>s&1||n.push(...e(i),...e(i|1<<s));return Float32Array.from(n)}customElements.define("gcc-robot-preview",W);function Nt(){let o=document.querySelector("gcc-robot-preview");o&&(typeof acquireVsCodeApi=="function"?It(o,acquireVsCodeApi()):_t(o))}function It(o,t){window.addEventListener("message",e=>{let n=e.data;n.title!==void 0&&(o.heading=n.title),n.problem!==void 0&&(o.problem=n.problem),n.scene&&o.setScene(n.scene),n.line!==void 0&&(o.line=n.line)}),o.addEventListener("choose",e=>{t.postMessage({choose:e.detail.line})}),t.postMessage({ready:!0})}function _t(o){let t=document.querySelector('script[type="application/json"]')?.textContent,e=JSON.parse(t??"{}");o.heading=e.title??"",e.text!==void 0&&o.setText(e.text),e.path&&o.setScene(Z(e.path)),e.served&&Ut(o)}function Ut(o){let t=async()=>{let n=await fetch("path");if(!n.ok)return;let i=await n.json();o.problem=i.problem??"",i.text!==void 0&&o.setText(i.text),i.path&&o.setScene(Z(i.path))},e=new EventSource("events");e.onmessage=n=>{let i=JSON.parse(n.data);i.line!==void 0&&(o.line=i.line),i.changed&&t()},e.onopen=()=>{o.problem="",t()},e.onerror=()=>{o.problem="gcc-robot has ended; the picture is the last one"},o.addEventListener("choose",n=>{fetch("choose",{method:"POST",body:String(n.detail.line)})})}Nt();})();
