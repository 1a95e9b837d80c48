"use strict";(()=>{var k={iso:[-Math.PI/4,.6155],top:[0,Math.PI/2],front:[0,0],right:[Math.PI/2,0]},_=class{turn=k.iso[0];tilt=k.iso[1];target=[0,0,0];scale=4;width=1;height=1;radius=100;basis(){let[e,t,n,i]=[Math.cos(this.turn),Math.sin(this.turn),Math.sin(this.tilt),Math.cos(this.tilt)];return[[e,t,0],[-t*n,e*n,i],[t*i,-e*i,n]]}fit(e){let[t,n]=e??[[-50,-50,-50],[50,50,50]];this.target=[0,1,2].map(a=>(t[a]+n[a])/2);let i=[0,1,2].map(a=>n[a]-t[a]);this.radius=Math.max(Math.hypot(...i)/2,.001);let[s,r]=this.basis(),l=a=>Math.max(a.reduce((h,c,d)=>h+Math.abs(c)*i[d],0),this.radius/50);this.scale=.86*Math.min(this.width/l(s),this.height/l(r))}look(e,t){[this.turn,this.tilt]=k[e]??k.iso,this.fit(t)}orbit(e,t){this.turn-=e*.008,this.tilt=Math.max(-Math.PI/2,Math.min(Math.PI/2,this.tilt+t*.008))}pan(e,t){let[n,i]=this.basis();for(let s=0;s<3;s++)this.target[s]+=(-e*n[s]+t*i[s])/this.scale}zoom(e,t,n){let i=this.scale,s=.02*Math.min(this.width,this.height)/this.radius;this.scale=Math.max(s,Math.min(1e5,i*e));let r=this.scale/i;this.pan(t-t*r,n-n*r)}project(e,t,n){let[i,s,r]=this.basis(),l=[e-this.target[0],t-this.target[1],n-this.target[2]],a=h=>h[0]*l[0]+h[1]*l[1]+h[2]*l[2];return[this.width/2+this.scale*a(i),this.height/2-this.scale*a(s),a(r)]}matrix(){let[e,t,n]=this.basis(),i=4*this.radius+Math.hypot(...this.target),s=[e.map(l=>l*2*this.scale/this.width),t.map(l=>l*2*this.scale/this.height),n.map(l=>-l/i)],r=new Float32Array(16);return s.forEach((l,a)=>{for(let h=0;h<3;h++)r[4*h+a]=l[h];r[12+a]=-l.reduce((h,c,d)=>h+c*this.target[d],0)}),r[15]=1,r}};var Q=["rapid","feed","arc","probe, tap"];function J(o){let e=atob(o),t=new Uint8Array(e.length);for(let n=0;n<e.length;n++)t[n]=e.charCodeAt(n);return t}function S(o){return new Float32Array(J(o).buffer)}function Z(o){let{machine:e,...t}=o;return{...t,machine:e&&{...e},positions:S(o.positions),kinds:J(o.kinds),lines:new Uint32Array(J(o.lines).buffer),times:S(o.times),feeds:S(o.feeds),joints:e?S(e.values):new Float32Array,figures:e?S(e.figure.points):new Float32Array}}function de(){return{uri:"",count:0,tools:[],bounds:null,cut:null,stock:null,seconds:0,rapidSeconds:0,cutLength:0,rapidLength:0,truncated:!1,machine:null,positions:new Float32Array,kinds:new Uint8Array,lines:new Uint32Array,times:new Float32Array,feeds:new Float32Array,joints:new Float32Array,figures:new Float32Array}}function E(o,e){let t=0,n=o.count-1;for(;t<n;){let i=t+n+1>>1;o.times[i]<=e?t=i:n=i-1}return Math.max(t,0)}function ee(o,e){let t=[];for(let n=0;n<o.count;n++)o.lines[n]===e&&n>0&&o.kinds[n]!==255&&t.push(n);return t}function pe(o,e){return o.tools.findLast(t=>t.point<=e)}function te(o,e){let{lines:t,every:n}=o.machine?.figure??{lines:[],every:1},i=3*t.reduce((h,c)=>h+c,0),s=i*Math.round(e/n),r=o.figures.subarray(Math.min(s,o.figures.length-i));if(!i||r.length<i||Number.isNaN(r[0]))return new Float32Array;let l=[],a=0;for(let h of t){for(let c=0;c<h-1;c++)l.push(...r.subarray(a+3*c,a+3*c+6));a+=3*h}return Float32Array.from(l)}var p=(o,e,t)=>[o/255,e/255,t/255],U={background:p(255,255,255),kinds:[p(226,119,38),p(24,92,190),p(15,146,106),p(158,54,160)],faint:p(216,220,228),mark:p(214,20,60),stock:p(150,140,120),machine:p(110,118,135),axes:[p(200,40,40),p(30,130,50),p(40,70,200)],tool:p(40,44,52),measure:p(90,40,160),text:"#282c34"},fe={background:p(30,32,38),kinds:[p(240,150,70),p(97,160,255),p(70,205,150),p(220,120,220)],faint:p(66,70,80),mark:p(255,90,120),stock:p(140,130,110),machine:p(165,172,190),axes:[p(235,90,90),p(90,200,110),p(110,140,255)],tool:p(230,230,235),measure:p(200,160,255),text:"#d7dae0"};function v(o){return`rgb(${o.map(e=>Math.round(e*255)).join(" ")})`}var ne=64;function ie(o){let e=[{name:"feed",unit:"mm/min",value:i=>o.feeds[i],limits:[null,null]}],t=o.machine;if(!t||o.joints.length===0)return e;let n=t.joints.length;return t.joints.forEach((i,s)=>{e.push({name:i,unit:t.units[s],value:r=>o.joints[r*n+s],limits:t.limits[s]??[null,null]}),e.push({name:`${i} speed`,unit:`${t.units[s]}/s`,value:r=>Ae(o,r,s,n),limits:[null,null]})}),e}function Ae(o,e,t,n){let i=e>0?o.times[e]-o.times[e-1]:0;return i>1e-6?(o.joints[e*n+t]-o.joints[(e-1)*n+t])/i:Number.NaN}function ke(o,e,t){let n=new Float64Array(t).fill(Number.POSITIVE_INFINITY),i=new Float64Array(t).fill(Number.NEGATIVE_INFINITY),s=(t-1)/Math.max(o.times[o.count-1]??0,1e-6);for(let r=0;r<o.count;r++){let l=Math.min(t-1,Math.max(0,Math.round(o.times[r]*s))),a=e.value(r);a<n[l]&&(n[l]=a),a>i[l]&&(i[l]=a)}return{low:n,high:i}}var H=class{constructor(e){this.canvas=e}picture=null;key="";draw(e,t,n,i){let s=devicePixelRatio||1,r=Math.max(2,Math.round(this.canvas.clientWidth*s)),l=Math.max(2,Math.round(this.canvas.clientHeight*s)),a=`${t.name} ${r} ${l} ${n.text}`;(this.key!==a||!this.picture)&&(this.picture=this.paint(e,t,n,r,l,s),this.key=a),this.canvas.width=r,this.canvas.height=l;let h=this.canvas.getContext("2d");if(!h)return;h.drawImage(this.picture,0,0);let c=Math.max(e.times[e.count-1]??0,1e-6),d=ne*s+i/c*(r-(ne+8)*s);h.fillStyle=v(n.mark),h.fillRect(Math.round(d),0,s,l);let b=e.count?t.value(E(e,i)):Number.NaN;h.font=`${12*s}px sans-serif`,h.textAlign=d>r/2?"right":"left",h.fillText(Number.isFinite(b)?`${+b.toFixed(2)} ${t.unit}`:"",d+(d>r/2?-6:6)*s,13*s)}forget(){this.picture=null}paint(e,t,n,i,s,r){let l=document.createElement("canvas");l.width=i,l.height=s;let a=l.getContext("2d");if(!a||e.count===0)return l;let h=ne*r,c=Math.max(2,Math.floor(i-h-8*r)),{low:d,high:b}=ke(e,t,c),[f,g]=[Number.POSITIVE_INFINITY,Number.NEGATIVE_INFINITY];for(let m=0;m<c;m++)d[m]<f&&(f=d[m]),b[m]>g&&(g=b[m]);g>f||([f,g]=Number.isFinite(f)?[f-1,g+1]:[0,1]);let y=m=>s-6*r-(m-f)/(g-f)*(s-24*r);a.fillStyle=n.text,a.font=`${11*r}px sans-serif`,a.textAlign="right",a.fillText(String(+g.toPrecision(5)),h-4*r,y(g)+4*r),a.fillText(String(+f.toPrecision(5)),h-4*r,y(f)),a.strokeStyle=v(n.mark),a.setLineDash([4,4]);for(let m of t.limits)m===null||m<f||m>g||(a.beginPath(),a.moveTo(h,y(m)),a.lineTo(h+c,y(m)),a.stroke());a.setLineDash([]),a.strokeStyle=v(n.kinds[1]),a.lineWidth=r,a.beginPath();let A=!1;for(let m=0;m<c;m++)d[m]>b[m]||(A?a.lineTo(h+m,y(d[m])):a.moveTo(h+m,y(d[m])),a.lineTo(h+m,y(b[m])),A=!0);return a.stroke(),l}};var Ee=60;function Me(o){let e=10**Math.floor(Math.log10(o));return[1,2,5,10].map(t=>t*e).find(t=>t>=o*.999)??10*e}var D=class{constructor(e){this.canvas=e}draw(e,t,n,i){let s=devicePixelRatio||1,{width:r,height:l}=t;this.canvas.width=Math.round(r*s),this.canvas.height=Math.round(l*s);let a=this.canvas.getContext("2d");if(a){a.scale(s,s),a.font="bold 12px sans-serif",a.textAlign="center",a.textBaseline="middle";for(let h of[0,1,2]){let c=[0,0,0];c[h]=i.axis*1.12;let[d,b]=t.project(...c);a.fillStyle=v(n.axes[h]),a.fillText("XYZ"[h],d,b)}i.frames&&this.frames(a,e,t,n),this.tools(a,e,t,n,i.until);for(let h of i.points)this.ring(a,t.project(...h),v(n.measure),5);i.tool&&this.cone(a,t.project(...i.tool),v(n.mark)),this.scale(a,t,n)}}frames(e,t,n,i){e.font="11px sans-serif",e.textAlign="left",e.fillStyle=i.text;for(let s of t.machine?.frames??[]){let[r,l]=n.project(...s.origin);e.fillText(s.name,r+8,l+10)}}tools(e,t,n,i,s){e.font="11px sans-serif",e.textAlign="left";for(let r of t.tools.slice(0,Ee)){if(r.point>=t.count||r.point>=s)continue;let l=[0,1,2].map(d=>t.positions[3*r.point+d]),[a,h]=n.project(...l);e.fillStyle=v(i.tool),e.beginPath(),e.moveTo(a,h-5),e.lineTo(a+4,h),e.lineTo(a,h+5),e.lineTo(a-4,h),e.fill();let c=r.diameter?` ⌀${+r.diameter.toFixed(3)}`:"";e.fillText(`T${r.number}${c}`,a+8,h-8)}}ring(e,[t,n],i,s){e.strokeStyle=i,e.lineWidth=2,e.beginPath(),e.arc(t,n,s,0,2*Math.PI),e.stroke()}cone(e,[t,n],i){e.fillStyle=i,e.beginPath(),e.moveTo(t,n),e.lineTo(t-6,n-16),e.lineTo(t+6,n-16),e.fill()}scale(e,t,n){let i=Me(80/t.scale),s=t.width-16,r=t.height-14;e.strokeStyle=e.fillStyle=n.text,e.lineWidth=2,e.beginPath(),e.moveTo(s-i*t.scale,r),e.lineTo(s,r),e.stroke(),e.textAlign="right",e.fillText(`${+i.toPrecision(6)} mm`,s,r-10)}};var G=class{element=document.createElement("div");space=document.createElement("div");window=document.createElement("div");lines=[];marked=-1;constructor(e){this.element.className="listing",this.element.tabIndex=0,this.window.className="window",this.space.append(this.window),this.element.append(this.space),this.element.addEventListener("scroll",()=>this.draw()),this.window.addEventListener("click",t=>{let n=t.target.closest("[data-line]")?.dataset.line;n&&e(Number(n))}),new ResizeObserver(()=>this.draw()).observe(this.element)}show(e){this.lines=e.split(/\r\n|\n|\r/),this.space.style.height=`${Math.min(this.lines.length*18,8e6)}px`,this.draw()}mark(e,t){this.marked=e;let n=this.element.clientHeight/18,i=this.element.scrollTop/(18*this.ratio());t&&(e<i||e>i+n-2)&&(this.element.scrollTop=(e-n/2)*18*this.ratio()),this.draw()}ratio(){return Math.min(1,8e6/Math.max(this.lines.length*18,1))}draw(){let e=this.element.scrollTop,t=Math.ceil(this.element.clientHeight/18)+1,n=Math.max(0,this.lines.length-t+2),i=Math.min(Math.floor(e/(18*this.ratio())),n);this.window.style.transform=`translateY(${e}px)`;let s=[];for(let r=i;r<Math.min(i+t,this.lines.length);r++){let l=document.createElement("div");l.dataset.line=String(r),l.className=r===this.marked?"row marked":"row";let a=document.createElement("i");a.textContent=String(r+1),l.append(a,this.lines[r]),s.push(l)}this.window.replaceChildren(...s)}};function be(o,e,t,n,i,s,r){let{positions:l,kinds:a}=o,[h,c,d]=e.basis(),[b,f,g]=e.target,y=e.scale,A=t-e.width/2,m=e.height/2-n,T=null,L=i*i,re=Number.NEGATIVE_INFINITY,[P,B,O]=[0,0,0],we=Math.min(o.count,r);for(let x=0;x<we;x++){let z=l[3*x]-b,j=l[3*x+1]-f,Y=l[3*x+2]-g,oe=y*(h[0]*z+h[1]*j+h[2]*Y)-A,ae=y*(c[0]*z+c[1]*j+c[2]*Y)-m,le=d[0]*z+d[1]*j+d[2]*Y;if(x>0&&a[x]!==255&&s&1<<a[x]){let N=oe-P,I=ae-B,he=N*N+I*I,F=he>0?Math.max(0,Math.min(1,-(P*N+B*I)/he)):0,ce=P+F*N,ue=B+F*I,q=ce*ce+ue*ue,me=O+F*(le-O);if(q<L-.25||q<L+.25&&me>re){L=Math.min(L,q),re=me;let K=X=>l[3*(x-1)+X]+F*(l[3*x+X]-l[3*(x-1)+X]);T={point:x,share:F,place:[K(0),K(1),K(2)]}}}P=oe,B=ae,O=le}return T}var M=1e5,Te=6;function se(o,e,t,n,i){let{positions:s,kinds:r}=o,{count:l,at:a}=e,h=t*t,c=0,d=0;for(let b=0;b<l;b++){let f=a(b),g=b+1<l?a(b+1):-1;if(!(b===0||g<0||r[f]===255||r[g]===255)&&!(n&&r[f]!==r[g])){let A=s[3*f]-s[3*d],m=s[3*f+1]-s[3*d+1],T=s[3*f+2]-s[3*d+2];if(A*A+m*m+T*T<=h)continue}if(i){if(c===i.length)return c+1;i[c]=f}c++,d=f}return c}function Fe(o){if(!o.bounds)return 1;let[e,t]=o.bounds;return Math.max(...t.map((n,i)=>n-e[i]),.001)}function ge(o,e,t){let n=Fe(o);for(let s of[!0,!1]){let r=n/10,l=n/1e5;if(se(o,e,r,s,null)>t)continue;for(let h=0;h<7;h++){let c=Math.sqrt(r*l);se(o,e,c,s,null)>t?l=c:r=c}let a=new Uint32Array(t);return a.slice(0,se(o,e,r,s,a))}let i=Math.ceil(e.count/t);return Uint32Array.from({length:Math.floor(e.count/i)},(s,r)=>e.at(r*i))}function ve(o){if(o.count<=M)return[];let e=[ge(o,{count:o.count,at:t=>t},M)];for(let t=1;t<Te;t++){let n=e[t-1];e.push(ge(o,{count:n.length,at:i=>n[i]},M>>t))}return e}var Se=`#version 300 es
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
}`,Re=`#version 300 es
precision mediump float;
flat in vec4 color;
out vec4 paint;
void main() {
  if (color.a < 0.5) discard;
  paint = color;
}`;function xe(o,e,t){let n=o.createShader(e);if(!n)throw new Error("the graphics context is lost");if(o.shaderSource(n,t),o.compileShader(n),!o.getShaderParameter(n,o.COMPILE_STATUS))throw new Error(o.getShaderInfoLog(n)??"shader");return n}var R=class{constructor(e){this.canvas=e;let t=e.getContext("webgl2",{antialias:!1,powerPreference:"high-performance"});if(!t)throw new Error("this browser has no WebGL 2");this.gl=t;let n=t.getExtension("WEBGL_debug_renderer_info");this.device=String(n?t.getParameter(n.UNMASKED_RENDERER_WEBGL):t.getParameter(t.RENDERER));let i=/swiftshader|llvmpipe|software/i.test(this.device);this.samples=i?0:Math.min(4,t.getParameter(t.MAX_SAMPLES));let s=t.createProgram();t.attachShader(s,xe(t,t.VERTEX_SHADER,Se)),t.attachShader(s,xe(t,t.FRAGMENT_SHADER,Re)),t.linkProgram(s),t.useProgram(s);for(let r of["view","shift","colors","shown","only"])this.uniforms[r]=t.getUniformLocation(s,r);this.path=t.createVertexArray(),this.extra=t.createVertexArray(),this.places=t.createBuffer(),this.kinds=t.createBuffer(),this.reduced=t.createVertexArray(),this.reducedPlaces=t.createBuffer(),this.reducedKinds=t.createBuffer(),this.extraPlaces=t.createBuffer(),this.target=t.createFramebuffer(),this.paint=t.createRenderbuffer(),this.depth=t.createRenderbuffer(),this.attributes(this.path,this.places,this.kinds),this.attributes(this.reduced,this.reducedPlaces,this.reducedKinds),this.attributes(this.extra,this.extraPlaces,null)}gl;device;drawn={segments:0,whole:!0};uniforms={};path;extra;places;kinds;reduced;reducedPlaces;reducedKinds;extraPlaces;target;paint;depth;samples;size=[0,0];count=0;levels=[];level=0;lastQuick=0;waiting=0;aside=!0;step=M;attributes(e,t,n){let i=this.gl;i.bindVertexArray(e),i.bindBuffer(i.ARRAY_BUFFER,t),i.enableVertexAttribArray(0),i.vertexAttribPointer(0,3,i.FLOAT,!1,0,0),n&&(i.bindBuffer(i.ARRAY_BUFFER,n),i.enableVertexAttribArray(1),i.vertexAttribIPointer(1,1,i.UNSIGNED_BYTE,0,0))}load(e){let t=this.gl;this.stop(),this.count=e.count,this.levels=ve(e),this.level=Math.min(this.level,Math.max(this.levels.length-1,0)),t.bindBuffer(t.ARRAY_BUFFER,this.places),t.bufferData(t.ARRAY_BUFFER,e.positions,t.STATIC_DRAW),t.bindBuffer(t.ARRAY_BUFFER,this.kinds),t.bufferData(t.ARRAY_BUFFER,e.kinds,t.STATIC_DRAW);let n=this.levels.reduce((l,a)=>l+a.length,0),i=new Float32Array(3*n),s=new Uint8Array(n),r=0;for(let l of this.levels)for(let a of l)i.set(e.positions.subarray(3*a,3*a+3),3*r),s[r++]=e.kinds[a];t.bindBuffer(t.ARRAY_BUFFER,this.reducedPlaces),t.bufferData(t.ARRAY_BUFFER,i,t.STATIC_DRAW),t.bindBuffer(t.ARRAY_BUFFER,this.reducedKinds),t.bufferData(t.ARRAY_BUFFER,s,t.STATIC_DRAW)}resize(e,t){if(this.size[0]===e&&this.size[1]===t)return;let n=this.gl;this.size=[e,t],this.canvas.width=e,this.canvas.height=t,n.bindRenderbuffer(n.RENDERBUFFER,this.paint),n.renderbufferStorageMultisample(n.RENDERBUFFER,this.samples,n.RGBA8,e,t),n.bindRenderbuffer(n.RENDERBUFFER,this.depth),n.renderbufferStorageMultisample(n.RENDERBUFFER,this.samples,n.DEPTH_COMPONENT24,e,t),n.bindFramebuffer(n.FRAMEBUFFER,this.target),n.framebufferRenderbuffer(n.FRAMEBUFFER,n.COLOR_ATTACHMENT0,n.RENDERBUFFER,this.paint),n.framebufferRenderbuffer(n.FRAMEBUFFER,n.DEPTH_ATTACHMENT,n.RENDERBUFFER,this.depth)}stop(){cancelAnimationFrame(this.waiting),this.waiting=0}quick(e,t){this.stop(),this.begin(e,this.samples===0?null:this.target);let n=this.levels.length===0;return n?this.strip(e,0,this.count):(this.adapt(t),this.thin(e)),this.finish(e,(n?this.count:this.levels[this.level].length)-1,n),n}adapt(e){let t=e-this.lastQuick;this.lastQuick=e;let n=t>200?3:t>100?2:1;t>50&&t<1e3?this.level=Math.min(this.level+n,this.levels.length-1):t<18&&t>0&&(this.level=Math.max(this.level-1,0))}whole(e,t){this.stop(),this.begin(e,this.target);let n=0,i=0,s=r=>{i&&r-i<20?this.step=Math.min(this.step*2,4e6):i&&r-i>120&&(this.step=Math.max(this.step/2,M/2)),i=r,this.gl.bindFramebuffer(this.gl.FRAMEBUFFER,this.target);let l=Math.min(this.count,n+Math.floor(this.step));this.strip(e,n,l),n=l,n<this.count?(this.gl.flush(),this.waiting=requestAnimationFrame(s)):(this.waiting=0,this.finish(e,this.count-1,!0),t())};this.waiting=requestAnimationFrame(s)}begin(e,t){let n=this.gl;this.aside=t!==null,n.bindFramebuffer(n.FRAMEBUFFER,t),n.viewport(0,0,this.size[0],this.size[1]),n.clearColor(...e.background,1),n.clear(n.COLOR_BUFFER_BIT|n.DEPTH_BUFFER_BIT),n.enable(n.DEPTH_TEST),n.depthFunc(n.LEQUAL),n.uniformMatrix4fv(this.uniforms.view,!1,e.matrix),n.uniform2f(this.uniforms.shift,0,0),n.uniform1ui(this.uniforms.shown,e.shown),n.uniform4f(this.uniforms.only,0,0,0,0),n.uniform3fv(this.uniforms.colors,e.colors.flat())}shade(e,t){let n=t?e.colors.map(()=>e.faint):e.colors;this.gl.uniform3fv(this.uniforms.colors,n.flat())}strip(e,t,n){let i=this.gl;i.bindVertexArray(this.path);let s=(l,a)=>{let h=Math.max(l-1,0);a-h>1&&i.drawArrays(i.LINE_STRIP,h,a-h)},r=Math.min(Math.max(e.until,t),n);this.shade(e,!1),s(t,r),r<n&&(this.shade(e,!0),s(r,n))}thin(e){let t=this.gl,n=this.levels[this.level],i=this.levels.slice(0,this.level).reduce((l,a)=>l+a.length,0);t.bindVertexArray(this.reduced);let s=n.length;if(e.until<this.count)for(s=0;s<n.length&&n[s]<e.until;)s++;let r=(l,a)=>{let h=Math.max(l-1,0);a-h>1&&t.drawArrays(t.LINE_STRIP,i+h,a-h)};this.shade(e,!1),r(0,s),s<n.length&&(this.shade(e,!0),r(s,n.length))}finish(e,t,n){let i=this.gl;for(let s of e.extras)this.lines(s.places,s.color);if(this.mark(e),this.aside){i.bindFramebuffer(i.READ_FRAMEBUFFER,this.target),i.bindFramebuffer(i.DRAW_FRAMEBUFFER,null);let[s,r]=this.size;i.blitFramebuffer(0,0,s,r,0,0,s,r,i.COLOR_BUFFER_BIT,i.NEAREST)}this.drawn={segments:Math.max(t,0),whole:n}}lines(e,t){let n=this.gl;n.bindVertexArray(this.extra),n.bindBuffer(n.ARRAY_BUFFER,this.extraPlaces),n.bufferData(n.ARRAY_BUFFER,e,n.STREAM_DRAW),n.vertexAttribI4ui(1,0,0,0,0),n.uniform4f(this.uniforms.only,...t,1),n.drawArrays(n.LINES,0,e.length/3),n.uniform4f(this.uniforms.only,0,0,0,0)}mark(e){if(e.marked.length===0)return;let t=this.gl;t.disable(t.DEPTH_TEST);for(let[n,i]of[[0,0],[1,0],[-1,0],[0,1],[0,-1]])t.uniform2f(this.uniforms.shift,2*n/this.size[0],2*i/this.size[1]),this.lines(e.marked,e.mark);t.uniform2f(this.uniforms.shift,0,0)}};var ye=`:host {
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
`;var Le=150,Pe=8,Be=[1,2,5,10,50,100,500];function u(o,e={}){return Object.assign(document.createElement(o),e)}function V(o){let e=t=>String(Math.floor(t)).padStart(2,"0");return`${Math.floor(o/3600)}:${e(o/60%60)}:${e(o%60)}`}var w=o=>String(+o.toFixed(3)),W=class extends HTMLElement{scene=de();theme=U;chosenTheme=null;camera=new _;renderer=null;root=this.attachShadow({mode:"open"});view=u("div",{className:"view"});canvas=u("canvas",{className:"path"});labels=new D(u("canvas",{className:"labels"}));facts=u("span",{className:"facts"});warning=u("span",{className:"warning"});title_=u("b");legend=u("span",{className:"legend"});note=u("div",{className:"note"});slider=u("input",{type:"range",min:"0",max:"1000",value:"1000",ariaLabel:"time"});output=u("output");playing=u("button",{textContent:"▶",title:"play (space)",ariaLabel:"play"});speed=u("select",{title:"times real speed",ariaLabel:"speed"});curve=u("select",{title:"curve",ariaLabel:"curve"});curveBox=u("div",{className:"curve"});plot=new H(u("canvas"));measuring=u("button",{textContent:"measure",title:"distance between two points of the path"});listing=new G(e=>{this.line=e,this.chose(e)});all=null;shown=255;machineShown=!0;marked=new Float32Array;markedLine=-1;seconds=Number.POSITIVE_INFINITY;player=0;queued=0;rest=0;points=[];frames=[];connectedCallback(){if(this.renderer)return;let e=new CSSStyleSheet;e.replaceSync(ye),this.root.adoptedStyleSheets=[e],this.build();try{this.renderer=new R(this.canvas)}catch(t){this.warning.textContent=`${t.message}: the tool path can't be drawn`}matchMedia("(prefers-color-scheme: dark)").addEventListener("change",()=>this.paintTheme()),new MutationObserver(()=>this.paintTheme()).observe(document.body,{attributeFilter:["class"]}),new ResizeObserver(()=>this.resize()).observe(this.view),this.canvas.addEventListener("webglcontextlost",t=>t.preventDefault()),this.canvas.addEventListener("webglcontextrestored",()=>{this.renderer=new R(this.canvas),this.renderer.load(this.scene),this.resize()}),this.paintTheme(),this.resize()}setScene(e){let t=this.scene.count===0,n=this.seconds>=this.end();this.scene=e,this.points=[],this.pause(),this.renderer?.load(e),this.plot.forget(),t&&this.camera.fit(C(e)),this.describe(),this.findMarked(),this.seconds=t||n?this.end():Math.min(this.seconds,this.end()),this.draw(!1)}setText(e){this.listing.element.hidden=!1,this.listing.show(e)}set heading(e){this.title_.textContent=e}set problem(e){this.warning.textContent=e}set line(e){this.markedLine=e,this.findMarked(),this.listing.mark(e,!0),this.draw(!1)}get line(){return this.markedLine}look(e){this.camera.look(e,C(this.scene)),this.draw(!1)}orbit(e,t){this.camera.orbit(e,t),this.draw(!0)}project(e,t,n){let i=this.canvas.getBoundingClientRect(),[s,r]=this.camera.project(e,t,n);return[i.left+s,i.top+r]}statistics(){return{...this.renderer?.drawn??{segments:0,whole:!1},device:this.renderer?.device??"",points:this.scene.count,frames:[...this.frames],busy:this.rest!==0||this.queued!==0}}build(){let e=u("div",{className:"bar"}),t=u("span"),n=u("button",{textContent:"machine",title:"path and machine",hidden:!0});n.onclick=()=>{this.camera.fit(Ne(this.scene)),this.draw(!1)},this.all=n;for(let r of Object.keys(k)){let l=u("button",{textContent:r});l.onclick=()=>this.look(r),t.append(l," ")}t.append(n);let i=u("button",{textContent:"◐",title:"light or dark",ariaLabel:"light or dark"});i.onclick=()=>{this.chosenTheme=this.theme===U?"dark":"light",this.paintTheme()},this.measuring.onclick=()=>this.measure(this.measuring.ariaPressed!=="true"),e.append(this.title_,this.facts,t,this.measuring,i,this.legend,this.warning),this.view.append(this.canvas,this.labels.canvas,this.note),this.listing.element.hidden=!0;let s=u("div",{className:"time"});for(let r of Be)this.speed.append(u("option",{value:String(r),textContent:`${r}×`}));this.speed.value="10",s.append(this.playing,this.slider,this.output,this.speed,this.curve),this.curveBox.append(this.plot.canvas),this.curveBox.hidden=!0,this.root.append(e,this.view,this.listing.element,s,this.curveBox),this.listen(),this.describe()}listen(){this.slider.oninput=()=>{this.pause(),this.goto(Number(this.slider.value)/1e3*this.end())},this.playing.onclick=()=>this.player?this.pause():this.play(),this.curve.onchange=()=>{this.curveBox.hidden=this.curve.value==="",this.drawCurve()},this.plot.canvas.onpointerdown=e=>this.gotoColumn(e.offsetX),this.plot.canvas.onpointermove=e=>{e.buttons&&this.gotoColumn(e.offsetX)},this.tabIndex=0,this.addEventListener("keydown",e=>this.key(e)),this.pointer()}gotoColumn(e){this.pause(),this.goto((e-64)/(this.plot.canvas.clientWidth-72)*this.end())}key(e){let t=e.composedPath()[0];if(t instanceof HTMLInputElement||t instanceof HTMLSelectElement)return;let n=Object.keys(k),i={ArrowLeft:[-20,0],ArrowRight:[20,0],ArrowUp:[0,-20],ArrowDown:[0,20]};if(e.key===" ")this.player?this.pause():this.play();else if(e.key==="Escape")this.measure(!1);else if(i[e.key])this.orbit(...i[e.key]);else if(n[Number(e.key)-1])this.look(n[Number(e.key)-1]);else return;e.preventDefault()}pointer(){let e=null,t=0,n=this.canvas;n.onpointerdown=i=>{e=[i.clientX,i.clientY],t=0,n.setPointerCapture(i.pointerId)},n.onpointermove=i=>{if(!e)return;let s=i.clientX-e[0],r=i.clientY-e[1];t+=Math.abs(s)+Math.abs(r),e=[i.clientX,i.clientY],i.shiftKey||i.buttons&6?this.camera.pan(s,r):this.camera.orbit(s,r),this.draw(!0)},n.onpointerup=i=>{e&&t<4&&i.button===0&&this.clicked(i.offsetX,i.offsetY),e=null},n.onwheel=i=>{i.preventDefault();let{width:s,height:r}=this.camera;this.camera.zoom(Math.exp(-i.deltaY*.0015),i.offsetX-s/2,i.offsetY-r/2),this.draw(!0)},n.ondblclick=()=>{this.camera.fit(C(this.scene)),this.draw(!1)},n.oncontextmenu=i=>i.preventDefault()}clicked(e,t){let n=be(this.scene,this.camera,e,t,Pe,this.shown,this.until());if(this.measuring.ariaPressed==="true"){if(!n)return;this.points=this.points.length===2?[n]:[...this.points,n],this.draw(!1);return}if(!n){this.line=-1;return}let i=this.scene.lines[n.point];this.line=i,this.tell(n),this.chose(i)}chose(e){this.dispatchEvent(new CustomEvent("choose",{detail:{line:e}}))}tell(e){let t=this.scene,n=pe(t,e.point),i=t.feeds[e.point];this.note.textContent=[`line ${t.lines[e.point]+1}: ${Q[t.kinds[e.point]]??""} to ${this.place(e.point)}`,[i?`${w(i)} mm/min`:"",V(t.times[e.point]),n?`T${n.number}`:""].filter(Boolean).join(" · ")].join(`
`)}place(e){return[0,1,2].map(t=>`${"XYZ"[t]}${w(this.scene.positions[3*e+t])}`).join(" ")}measure(e){this.measuring.ariaPressed=String(e),this.view.classList.toggle("measuring",e),this.points=[],this.note.textContent=e?"click two points of the path":"",this.draw(!1)}measured(){if(this.points.length<2)return;let[e,t]=this.points.map(i=>i.place),n=t.map((i,s)=>i-e[s]);this.note.textContent=`${w(Math.hypot(...n))} mm
ΔX ${w(n[0])}  ΔY ${w(n[1])}  ΔZ ${w(n[2])}`}describe(){let e=this.scene,t=e.bounds?e.bounds[1].map((s,r)=>w(s-(e.bounds?.[0][r]??0))).join(" × "):"";this.facts.textContent=e.count?`${t} mm · ${V(e.seconds)} h · cut ${w(e.cutLength/1e3)} m · rapid ${w(e.rapidLength/1e3)} m`:"no moves",e.truncated&&(this.warning.textContent="the path is longer than what is shown"),this.drawLegend();let n=this.curve.value,i=ie(e).map(s=>u("option",{value:s.name,textContent:`${s.name}, ${s.unit}`}));this.curve.replaceChildren(u("option",{value:"",textContent:"no curve"}),...i),this.curve.value=i.some(s=>s.value===n)?n:"",this.curveBox.hidden=this.curve.value===""}drawLegend(){let e=new Set(this.scene.kinds),t=Q.map((n,i)=>{if(!e.has(i))return"";let s=u("input",{type:"checkbox",checked:(this.shown&1<<i)!==0});s.onchange=()=>{this.shown^=1<<i,this.draw(!1)};let r=u("i");r.style.background=v(this.theme.kinds[i]);let l=u("label");return l.append(s,r,n),l});this.legend.replaceChildren(...t,this.machineBox())}machineBox(){let e=this.scene.machine;if(this.all&&(this.all.hidden=!e?.figure.lines.length),!e)return"";let t=u("input",{type:"checkbox",checked:this.machineShown});t.onchange=()=>{this.machineShown=t.checked,this.draw(!1)};let n=u("i");n.style.background=v(this.theme.machine);let i=u("label",{title:[e.title,e.note].filter(Boolean).join(`
`)});return i.append(t,n,e.note?`${e.id} (!)`:e.id),i}paintTheme(){let e=document.body.classList,t=e.contains("vscode-dark")||e.contains("vscode-high-contrast"),n=e.contains("vscode-light")||e.contains("vscode-high-contrast-light"),i=matchMedia("(prefers-color-scheme: dark)").matches,s=this.chosenTheme??(n?"light":t||i?"dark":"light");this.theme=s==="dark"?fe:U,this.style.setProperty("--background",v(this.theme.background)),this.style.setProperty("--text",this.theme.text),this.style.setProperty("--mark",v(this.theme.mark)),this.style.setProperty("--feed",v(this.theme.kinds[1])),this.plot.forget(),this.drawLegend(),this.draw(!1)}resize(){let{clientWidth:e,clientHeight:t}=this.view;if(!e||!t)return;let n=this.camera.width===1;this.camera.width=e,this.camera.height=t,n&&this.camera.fit(C(this.scene));let i=devicePixelRatio||1;this.renderer?.resize(Math.round(e*i),Math.round(t*i)),this.draw(!1)}end(){return this.scene.count?this.scene.times[this.scene.count-1]:0}until(){return this.seconds>=this.end()?this.scene.count:Math.min(this.scene.count,E(this.scene,this.seconds)+1)}goto(e){this.seconds=Math.max(0,Math.min(this.end(),e)),this.draw(!0)}play(){if(!this.scene.count)return;this.seconds>=this.end()&&(this.seconds=0),this.playing.textContent="❚❚";let e=performance.now(),t=n=>{let i=(n-e)/1e3*Number(this.speed.value);e=n,this.goto(this.seconds+i),this.player=this.seconds<this.end()?requestAnimationFrame(t):0,this.player||this.pause()};this.player=requestAnimationFrame(t)}pause(){cancelAnimationFrame(this.player),this.player=0,this.playing.textContent="▶"}toolPlace(){let e=this.scene;if(!e.count||this.seconds>=this.end())return null;let t=E(e,this.seconds),n=Math.min(t+1,e.count-1),i=e.times[n]-e.times[t],s=i>0?Math.min(1,(this.seconds-e.times[t])/i):0,r=l=>e.positions[3*t+l]+s*(e.positions[3*n+l]-e.positions[3*t+l]);return[r(0),r(1),r(2)]}findMarked(){let e=this.markedLine<0?[]:ee(this.scene,this.markedLine);this.marked=new Float32Array(6*e.length),e.forEach((n,i)=>{this.marked.set(this.scene.positions.subarray(3*n-3,3*n+3),6*i)}),this.note.textContent="";let t=e.at(-1);t!==void 0&&this.tell({point:t,share:1,place:[0,0,0]})}picture(){let e=this.axisLength(),n=[...[0,1,2].map(r=>{let l=new Float32Array(6);return l[3+r]=e,{places:l,color:this.theme.axes[r]}}),...this.machineLines()];this.scene.stock&&n.push({places:Ie(this.scene.stock),color:this.theme.stock});let[i,s]=this.points;return s&&n.push({places:Float32Array.from([...i.place,...s.place]),color:this.theme.measure}),{matrix:this.camera.matrix(),background:this.theme.background,colors:this.theme.kinds,shown:this.shown,until:this.until(),faint:this.theme.faint,marked:this.marked,mark:this.theme.mark,extras:n}}machineLines(){let e=this.scene.machine;if(!e||!this.machineShown)return[];let t=this.markedLine<0?[]:ee(this.scene,this.markedLine),i=this.seconds>=this.end()?t.at(-1)??this.scene.count-1:E(this.scene,this.seconds),s=1.5*this.axisLength();return[...e.frames.flatMap(l=>l.axes.map((a,h)=>({places:Float32Array.from([...l.origin,...l.origin.map((c,d)=>c+s*a[d])]),color:this.theme.axes[h]}))),{places:te(this.scene,i),color:this.theme.machine}]}axisLength(){let e=this.scene.bounds;return e?Math.max(...e[1].map((t,n)=>t-e[0][n]),1)/8:10}draw(e){clearTimeout(this.rest),this.rest=0,this.queued||=requestAnimationFrame(t=>{this.queued=0,this.frames.push(t),this.frames.length>240&&this.frames.shift(),this.paint(e,t)})}paint(e,t){this.drawTime(),this.measured(),this.labels.draw(this.scene,this.camera,this.theme,{axis:this.axisLength(),tool:this.toolPlace(),points:this.points.map(i=>i.place),until:this.until(),frames:this.machineShown}),!(!this.renderer||this.renderer.quick(this.picture(),t))&&(this.rest=window.setTimeout(()=>{this.renderer?.whole(this.picture(),()=>{this.rest=0})},e?Le:0))}drawTime(){this.slider.value=String(this.end()?this.seconds/this.end()*1e3:0),this.output.textContent=`${V(this.seconds)} / ${V(this.end())}`,this.drawCurve()}drawCurve(){let e=ie(this.scene).find(t=>t.name===this.curve.value);e&&this.plot.draw(this.scene,e,this.theme,this.seconds)}};function C(o){let{bounds:e,stock:t}=o;if(!e||!t)return e??t;let n=(i,s)=>e[s].map((r,l)=>i(r,t[s][l]));return[n(Math.min,0),n(Math.max,1)]}function Ne(o){let e=C(o),t=te(o,0),n=(o.machine?.frames??[]).map(s=>[...s.origin]);for(let s=0;s<t.length;s+=3)n.push([...t.subarray(s,s+3)]);if(n.push(...e??[]),!n.length)return null;let i=s=>[0,1,2].map(r=>s(...n.map(l=>l[r])));return[i(Math.min),i(Math.max)]}function Ie([o,e]){let t=i=>[0,1,2].map(s=>i>>s&1?e[s]:o[s]),n=[];for(let i=0;i<8;i++)for(let s=0;s<3;s++)i>>s&1||n.push(...t(i),...t(i|1<<s));return Float32Array.from(n)}customElements.define("gcc-robot-preview",W);function _e(){let o=document.querySelector("gcc-robot-preview");o&&(typeof acquireVsCodeApi=="function"?Ue(o,acquireVsCodeApi()):He(o))}function Ue(o,e){window.addEventListener("message",t=>{let n=t.data;n.title!==void 0&&(o.heading=n.title),n.problem!==void 0&&(o.problem=n.problem),n.scene&&o.setScene(n.scene),n.line!==void 0&&(o.line=n.line)}),o.addEventListener("choose",t=>{e.postMessage({choose:t.detail.line})}),e.postMessage({ready:!0})}function He(o){let e=document.querySelector('script[type="application/json"]')?.textContent,t=JSON.parse(e??"{}");o.heading=t.title??"",t.text!==void 0&&o.setText(t.text),t.path&&o.setScene(Z(t.path)),t.served&&De(o)}function De(o){let e=async()=>{let n=await fetch("path");if(!n.ok)return;let i=await n.json();o.problem=i.problem??"",i.text!==void 0&&o.setText(i.text),i.path&&o.setScene(Z(i.path))},t=new EventSource("events");t.onmessage=n=>{let i=JSON.parse(n.data);i.line!==void 0&&(o.line=i.line),i.changed&&e()},t.onopen=()=>{o.problem="",e()},t.onerror=()=>{o.problem="gcc-robot has ended; the picture is the last one"},o.addEventListener("choose",n=>{fetch("choose",{method:"POST",body:String(n.detail.line)})})}_e();})();
